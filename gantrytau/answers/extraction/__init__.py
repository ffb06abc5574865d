"""The equations of a mechanism between its tool, its joints and their forces."""
