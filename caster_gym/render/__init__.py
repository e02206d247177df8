"""Pictures of a robot on its path, drawn with pygame-ce from scenes alone."""
