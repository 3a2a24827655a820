"""What every command that simulates shares: preparing, starting, running."""
