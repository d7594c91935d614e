"""Stages and forces of a frame: adapters between the trees and the kernels, one file each, in the order of step()."""
