"""What a run is asked for: file, scene, numbers."""
