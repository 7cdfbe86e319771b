"""Each file holds one physical effect; `ankle_physics.term.term_library` finds them all."""
