"""What compiled code is made of: SIMD, elementary functions, MuJoCo's library, call boundaries."""

from twin.compiled.cache import install

install()
