"""What a scene does not need: the activity of its elements, and the model without those that hardly take part."""
