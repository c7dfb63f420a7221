"""The one exception root of the project, and its warnings."""


class TwinError(Exception):
    """A mistake a person can mend; the message names the file, field, value and what is allowed."""


class TwinWarning(UserWarning):
    """Something a person should know about a file of theirs that is read nevertheless."""
