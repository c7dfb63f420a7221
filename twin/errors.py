"""The one exception root of the project."""


class TwinError(Exception):
    """A mistake a person can mend; the message names the file, field, value and what is allowed."""
