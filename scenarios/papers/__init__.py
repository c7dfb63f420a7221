"""Tables and figures of the papers beside ours."""
