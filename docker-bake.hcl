# The image for several kinds of computers at once:
#
#   docker buildx bake -f docker-bake.hcl        for this computer, into the engine
#   docker buildx bake -f docker-bake.hcl all    for 64-bit PCs and 64-bit ARM, into heel.tar (OCI)
#
# Other kinds than this computer's are emulated: the kernel needs QEMU for them (Debian and Ubuntu:
# the package qemu-user-static), and a builder of the driver docker-container
# (docker buildx create --use).

group "default" {
  targets = ["here"]
}

target "here" {
  context = "."
  target  = "service"
  tags    = ["heel-follow"]
  output  = ["type=docker"]
}

target "all" {
  context   = "."
  target    = "service"
  tags      = ["heel-follow"]
  platforms = ["linux/amd64", "linux/arm64"]
  output    = ["type=oci,dest=heel.tar"]
}
