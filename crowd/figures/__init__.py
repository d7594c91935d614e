"""The figures and the table of the character-fluid paper from one run of ours, each with a pass or a fail."""
