"""What tests compare the product with: written down from the model's page, without a line of the product."""
