"""What a robot measures there: exact rays first, then each sensor with its errors."""
