"""The simulated camera's picture: a kept software renderer, and what a real camera adds to it.

Needs the extra `sim`; import `heel.services.simulator.render.renderer` only where pictures are
wanted.
"""
