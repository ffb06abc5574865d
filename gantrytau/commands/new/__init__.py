"""`gantrytau new`: a project of your own to begin with."""

from gantrytau.commands.printing.command_group import group

PLACES = {"robot": ("new.new_robot", "gantrytau new robot my_robot && cd my_robot && python -m pytest")}
app = group("Write a project of your own to begin with.", PLACES)
