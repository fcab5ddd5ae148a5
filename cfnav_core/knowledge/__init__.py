"""What models know before they train: made once from training scenes, kept in one file."""
