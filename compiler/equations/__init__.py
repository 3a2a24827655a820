"""The equations of a formulation as a book prints them."""
