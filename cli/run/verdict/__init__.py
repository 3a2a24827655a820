"""What a finished or a stopped run says of itself."""
