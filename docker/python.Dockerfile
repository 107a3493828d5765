# The same without an installed ROS, which comes from wheels; reads all formats:
#   docker build -f docker/python.Dockerfile -t frac_accel .
#   docker run --rm -v "$PWD:/data" frac_accel identify drive.mcap -o sensor.yaml
#   docker run --rm --network host --ipc host -v "$PWD:/data:ro" --entrypoint python frac_accel \
#       -m frac_accel.nodes.corrector --ros-args -p model_file:=/data/sensor.yaml
FROM python:3.12-slim

ENV PIP_NO_CACHE_DIR=1
COPY . /source
RUN pip install "/source[ros,formats,watch]" && rm -rf /source

WORKDIR /data
ENTRYPOINT ["frac_accel"]
CMD ["--help"]
