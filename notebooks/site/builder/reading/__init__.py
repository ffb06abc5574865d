"""What the sources know: public names, signatures, docstrings, messages, and the tasks by which they are ordered."""
