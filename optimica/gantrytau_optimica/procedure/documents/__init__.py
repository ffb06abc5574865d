"""A plan for who carries it out: files, page, pictures, robot program."""
