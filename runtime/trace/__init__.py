"""What a run stores, and reads back."""
