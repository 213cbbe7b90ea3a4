# One image for every service; the container's command chooses: `heel SERVICE`.
#
# What runs networks is in it (extra `neural`), the networks themselves are not: see docker-compose.yml.
# Not in it: what draws plots (extra `eval`), and the renderer of the simulated world (extra `sim`),
# 154 MB, that no robot needs: the target `demo` is the same image with it.
#
# For a Raspberry Pi and other computers of another kind: docker-bake.hcl.
FROM python:3.11-slim-bookworm AS heel

ENV PYTHONUNBUFFERED=1 \
    PIP_NO_CACHE_DIR=1 \
    PIP_DISABLE_PIP_VERSION_CHECK=1 \
    PIP_ROOT_USER_ACTION=ignore

RUN useradd --uid 10001 --no-create-home --shell /usr/sbin/nologin heel \
    && install -d -o heel -g heel -m 700 /var/lib/heel

WORKDIR /src

# Dependencies come before the code: a change in the code rebuilds the small last layers only.
COPY pyproject.toml constraints.txt ./
RUN python3 -c "import tomllib; p = tomllib.load(open('pyproject.toml', 'rb')); print(*p['build-system']['requires'], *p['project']['dependencies'], *p['project']['optional-dependencies']['neural'], sep='\n')" > /tmp/requirements.txt \
    && python3 -m pip install -r /tmp/requirements.txt -c constraints.txt \
    && rm /tmp/requirements.txt

COPY README.md LICENSE ./
COPY src src
COPY schemas schemas
COPY evaluation evaluation
COPY services services
RUN python3 -m pip install --no-deps --no-build-isolation .

USER heel
WORKDIR /

STOPSIGNAL SIGTERM
ENTRYPOINT ["heel"]
CMD ["--help"]

# For `docker compose --profile demo up`.
FROM heel AS demo
USER root
# Its software renderer asks for libX11, and for no display.
RUN apt-get update -qq && apt-get install -y -qq --no-install-recommends libx11-6 \
    && rm -rf /var/lib/apt/lists/*
COPY constraints.txt /tmp/
RUN python3 -m pip install panda3d -c /tmp/constraints.txt && rm /tmp/constraints.txt
USER heel

# The last one is what `docker build .` makes.
FROM heel AS service
