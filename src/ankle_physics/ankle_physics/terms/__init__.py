"""One physical effect a file; `ankle_physics.term.term_library` finds them all."""
