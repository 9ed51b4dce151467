"""What the product is measured beside, one peer a file."""
