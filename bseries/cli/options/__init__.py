"""Arguments and options that several verbs share."""
