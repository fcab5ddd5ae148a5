"""The paper's tables and figures as one command: rows, runs, a grid that makes them, statistics."""
