"""What tests share: a Zenoh network of their own, processes that never outlive them, messages."""
