"""`python -m services.web`: the web process."""

from __future__ import annotations

from services.runtime.command_line import service_app
from services.web.settings import WebServiceSettings

if __name__ == "__main__":
    service_app("web", WebServiceSettings, "Run the web page process.")
