"""What `python -m scripts.fuzz_files` does: mutators for each format, the readers, trials in processes of their own."""
