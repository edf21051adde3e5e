"""Inverse design: the gradient with which a part deforms as wanted."""
