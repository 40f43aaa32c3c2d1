"""Laws: elastic energy, stress and second derivative of a displacement gradient, defined once.

In: a displacement gradient and the Lame parameters [Pa], on the device.
Out: an ElasticLaw of warp functions for every name in LAWS.
Read: law, linear, neo_hookean, corotated, kernels_tensor.
"""
