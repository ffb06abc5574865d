"""What things say of themselves: short words for values and records, descriptions as text and HTML, pages."""
