"""The person a user pointed at, kept by the colours of the clothes: no background, no network."""
