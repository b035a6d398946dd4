"""A course on backward error analysis: slides, a handout with proofs, exercises; Markdown beside these files."""
