"""What our methods cost inside other libraries."""
