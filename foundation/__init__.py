"""What the packages have in common and none of them owns: how much memory there is, how to install what is optional."""
