"""OBJ and MTL files, in all the ways in which modellers write them."""

import numpy as np
import pytest
from sim_bridge.sweet_home.obj import Material, read_materials, read_obj


def test_polygons_become_fans_and_negative_numbers_count_back():
    text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\nv 9 9 9 1.0\nf -1 -2 -3\n"
    obj = read_obj(text)
    assert obj.vertices.tolist()[-1] == [9, 9, 9]
    assert obj.groups["", ""][..., 0].tolist() == [[0, 1, 2], [0, 2, 3], [4, 3, 2]]
    assert (obj.groups["", ""][..., 1:] == -1).all()


def test_corners_name_vertex_coordinates_and_normal():
    text = (
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0.5\nvt 0.25 0.75 0\nvn 0 0 1\nf 1/1/1 2//1 \\\n 3/-1/-1\n"
    )
    obj = read_obj(text)
    assert obj.groups["", ""].tolist() == [[[0, 0, 0], [1, -1, 0], [2, 1, 0]]]
    assert obj.coordinates.tolist() == [[0.5, 0], [0.25, 0.75]]
    assert obj.normals.tolist() == [[0, 0, 1]]


def test_each_material_is_one_group_wherever_its_faces_stand():
    text = (
        "mtllib one.mtl\r\nmtllib two words.mtl\r\nv 0 0 0\r\nv 1 0 0\r\nv 0 1 0\r\n"
        "usemtl red paint\r\nf 1 2 3\r\ng arm\r\ns 1\r\nusemtl blue\r\nf 3 2 1\r\n"
        "usemtl red paint\r\nf 2 3 1\r\nusemtl unused\r\n"
    )
    obj = read_obj(text)
    assert obj.libraries == ("one.mtl", "two words.mtl")
    assert {name: len(group) for (name, _), group in obj.groups.items()} == {
        "red paint": 2,
        "blue": 1,
    }


def test_lines_and_points_are_no_faces():
    obj = read_obj("v 0 0 0\nv 1 0 0\nl 1 2\np 1\nf 1 2\n")
    assert obj.groups == {}
    assert obj.normals.shape == (0, 3)


@pytest.mark.parametrize("face", ["1 2 4", "0 1 2", "1 2 -4", "1/1 2/1 3/1", "/1 2 3", "1 2 x"])
def test_a_face_of_what_is_not_there(face):
    with pytest.raises(ValueError, match=r"found corner|invalid literal"):
        read_obj(f"v 0 0 0\nv 1 0 0\nv 0 1 0\nf {face}\n")


def test_materials():
    text = (
        "Kd 9 9 9\nnewmtl plain\nnewmtl glass\n\tKd 0.2 0.4 1.5\n d -halo 0.25\nKs 0.3 0.6 0.9\n"
        "Ns 32\nmap_Kd a picture.JPG\nillum 2\nnewmtl old\nTr 0.75\nNs 900\nKd spectral x\n"
    )
    with pytest.raises(ValueError, match="could not convert"):
        read_materials(text)
    found = read_materials(text.replace("Kd spectral x\n", ""))
    assert found["plain"] == Material()
    assert found["glass"].colour == (0.2, 0.4, 1)
    assert (found["glass"].alpha, found["glass"].picture) == (0.25, "a picture.JPG")
    assert np.isclose(found["glass"].specular, 0.6)
    assert found["glass"].shininess == 0.25
    assert (found["old"].alpha, found["old"].shininess) == (0.25, 1)
