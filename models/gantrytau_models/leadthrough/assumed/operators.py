"""People who lead a tool: `operators.SKILLED`, `.ROUGH`. Their values are assumed, not printed: operators.toml."""

from gantrytau_models.leadthrough.assumed.records import OperatorRecord, read

SKILLED: OperatorRecord = read("operators", "SKILLED")
ROUGH: OperatorRecord = read("operators", "ROUGH")
