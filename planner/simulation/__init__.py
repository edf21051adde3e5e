"""The printed part under load: what a plan, a profile or a coupon does when it is pulled."""
