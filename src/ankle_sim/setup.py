from setuptools import find_packages, setup

package_name = "ankle_sim"

setup(
    name=package_name,
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package_name}"]),
        (f"share/{package_name}", ["package.xml"]),
        (f"share/{package_name}/config", ["config/k_and_g_jump.yaml"]),
    ],
    install_requires=["setuptools"],
    # colcon test runs pytest where this names it.
    extras_require={"test": ["pytest"]},
    zip_safe=False,
    maintainer="Ankle perturbation laboratory",
    maintainer_email="ankle.lab@example.com",
    description="A virtual rig and subject behind the topics of the real one.",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            "ankle_sim = ankle_sim.ankle_sim_node:main",
        ],
    },
)
