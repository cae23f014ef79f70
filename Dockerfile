# The nodes and the command `redres`, with ROS 2 from PyPI, for a user without rights:
#   docker build -t redres_ros .
#   mkdir -p out && docker run --rm -v "$PWD/out:/home/redres/out" redres_ros demo --out out
# With nodes on the host: docker run --rm --network host --ipc host redres_ros watch
FROM python:3.12-slim AS build
WORKDIR /source
COPY . .
RUN python -m venv /opt/redres && /opt/redres/bin/pip install --no-cache-dir '.[ros]'

FROM python:3.12-slim
# Pinocchio's wheel takes this library from the system, and a slim image has none.
# hadolint ignore=DL3008
RUN apt-get update \
    && apt-get install -y --no-install-recommends libgomp1 \
    && rm -rf /var/lib/apt/lists/* \
    && useradd --create-home --uid 1000 redres
COPY --from=build /opt/redres /opt/redres
ENV PATH=/opt/redres/bin:$PATH AMENT_PREFIX_PATH=/opt/redres
USER 1000
WORKDIR /home/redres
# What keeps the limits is compiled once, here, and not at every start.
RUN python -c 'import redres_ros.limits'
ENTRYPOINT ["redres"]
