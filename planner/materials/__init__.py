"""Materials: constitutive laws, stiffness between the catalogue grades, and the inverse."""
