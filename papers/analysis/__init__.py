"""Analysis that only the papers need."""
