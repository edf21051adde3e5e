"""What people see of a diagnosis: words, tables, figures and a folder with all of them."""
