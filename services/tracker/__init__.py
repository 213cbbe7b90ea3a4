"""Blobs to people with identities: motion, association, occlusion, identity at the split."""
