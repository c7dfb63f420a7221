"""What the joint observer is measured against."""
