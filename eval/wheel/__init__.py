"""The wheel and the source archive: built, and used as somebody would who has only these."""
