"""Commands around recordings: making one, checking one, playing one."""
