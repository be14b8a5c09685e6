# The simulator on a processor, no GPU, by the same two commands as on any Debian machine.
#
#   docker build -t scarl-sionna .
#   docker run --rm -v "$PWD/out:/out" scarl-sionna make demo OUT=/out
#   docker run --rm scarl-sionna make test
FROM debian:12-slim
RUN apt-get update \
    && apt-get install -y --no-install-recommends make python3 python3-pip python3-venv \
    && rm -rf /var/lib/apt/lists/*
WORKDIR /opt/scarl-sionna
COPY . .
RUN PIP_NO_CACHE_DIR=1 make setup && rm -rf /var/lib/apt/lists/*
ENV PATH="/opt/scarl-sionna/.venv/bin:$PATH"
CMD ["make", "demo"]
