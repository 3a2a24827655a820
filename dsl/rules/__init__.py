"""What must hold of a network; findings, never exceptions."""
