"""What a robot on its path looks like: frames for people and videos, drawn with pygame-ce from scenes alone."""
