"""The command line, `gantrytau`: its commands stand in `gantrytau.commands`."""

from gantrytau.commands.app import app

if __name__ == "__main__":
    app()
