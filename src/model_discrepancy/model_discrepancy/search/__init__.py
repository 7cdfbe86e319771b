"""The search for terms that the base model lacks."""
