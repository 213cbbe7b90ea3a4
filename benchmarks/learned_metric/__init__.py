"""A metric of appearance learned from the scene: what was tried for galleries, see identity.md."""
