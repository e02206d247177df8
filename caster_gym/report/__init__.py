"""What is written for readers: pages, tables, figures, and the folders of runs."""
