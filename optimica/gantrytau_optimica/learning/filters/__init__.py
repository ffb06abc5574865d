"""Filters and windows of learning control."""
