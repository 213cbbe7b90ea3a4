# One image for every service; the container's command chooses: `heel SERVICE`.
#
# What runs networks is in it (extra `neural`), the networks themselves are not: see docker-compose.yml.
# Not in it: what draws plots (extra `eval`), and the renderer of the simulated world (extra `sim`),
# 154 MB, that no robot needs. `heel demo` belongs on a desk: what is missing it names.
#
# For a Raspberry Pi and other computers of another kind: docker-bake.hcl.
FROM python:3.11-slim-bookworm

ENV PYTHONUNBUFFERED=1 \
    PIP_NO_CACHE_DIR=1 \
    PIP_DISABLE_PIP_VERSION_CHECK=1 \
    PIP_ROOT_USER_ACTION=ignore

RUN useradd --uid 10001 --no-create-home --shell /usr/sbin/nologin heel

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
