# Not tested by continuous integration.
#   docker build -t cutting-verification .
#   docker run -v "$PWD/out:/out" cutting-verification run --quick --out /out/run
FROM python:3.12-bookworm
RUN apt-get update && apt-get install -y --no-install-recommends git make
WORKDIR /lab
COPY . .
# names what the system lacks and, as root, installs it
RUN make setup && .venv/bin/verify doctor --compile && rm -rf /var/lib/apt/lists/*
ENV PATH=/lab/.venv/bin:$PATH OMP_NUM_THREADS=1 MPLBACKEND=Agg PYVISTA_OFF_SCREEN=true
ENTRYPOINT ["verify"]
CMD ["--help"]
