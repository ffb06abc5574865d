"""What people hand in: refusals, checks, units, tables, files of settings and names, the same at every border."""
