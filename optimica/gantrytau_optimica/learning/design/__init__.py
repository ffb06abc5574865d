"""Filters of learning that hold for robots whose resonances are not known well."""
