"""Numbers of the cores, changed one by one: does a unit test notice?"""
