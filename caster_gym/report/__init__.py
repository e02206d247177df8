"""Output for readers: pages, tables, figures, and the folders of runs."""
