//! Files that mean harm: that grow without bounds, promise more than they hold, or name files that are none of theirs.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

use flate2::Compression;
use flate2::write::ZlibEncoder;
use relt::convert::{Job, convert};
use relt::load::{self, Reach, Watch};

use crate::faults::assert_faults;
use crate::files::{Folder, REST, around};

/// A triangle.
const OBJ: &[u8] = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

#[test]
fn entities_are_not_known_at_all() {
    let text = format!(
        "<!DOCTYPE scene [<!ENTITY a 'ha'><!ENTITY b '&a;&a;'><!ENTITY c SYSTEM 'file:///etc/passwd'>]>\n{}",
        around("<shape type='cube' id='&b;&c;'/>")
    );
    assert_faults(&text, &[], &["1:1: malformed XML: "]);
    assert_faults(
        &around("<shape type='cube' id='&b;'/>"),
        &[],
        &["2:24: malformed XML: unknown entity reference 'b'"],
    );
}

#[test]
fn values_of_values_do_not_grow_without_bounds() {
    let mut text = format!("<scene version='3.0.0'>\n<default name='a0' value='{}'/>\n", "x".repeat(1000));
    for i in 1..12 {
        let before = format!("$a{}", i - 1);
        writeln!(text, "<default name='a{i}' value='{}'/>", [&before[..]; 10].join(" ")).unwrap();
    }
    write!(text, "{REST}</scene>").unwrap();
    // the fifth would take 110 MB
    let error = Folder::new(&[]).load(&text, &[]).unwrap_err();
    let first = &error.faults()[0];
    assert!(
        first.message.ends_with("is too long: all values together may add 16777216 bytes to a scene"),
        "{}",
        first.message
    );
    assert!(error.to_string().len() < 1_000_000, "messages do not grow either");
}

#[test]
fn references_do_not_nest_without_end() {
    let chain = |count: usize| {
        let mask = |i| format!("<bsdf type='mask' id='b{i}'><ref id='b{}'/></bsdf>", i + 1);
        let links: String = (1..count).map(mask).collect();
        around(&format!("<shape type='cube'><ref id='b1'/></shape>{links}<bsdf type='diffuse' id='b{count}'/>"))
    };
    Folder::new(&[]).load(&chain(7), &[]).unwrap();
    let error = Folder::new(&[]).load(&chain(100_000), &[]).unwrap_err();
    assert_eq!(error.faults()[0].message, "bsdfs are inside one another deeper than 64 levels");
}

#[test]
fn as_many_faults_are_told_as_somebody_may_read() {
    let unknown = "<bsdf type='diffuse'><float name='alpha' value='1'/></bsdf>\n".repeat(20_000);
    let named: String = (0..20_000).map(|i| format!("<bsdf type='diffuse' id='of a name {i}'/>")).collect();
    let absent = "<shape type='cube'><ref id='of a name'/></shape>".repeat(20_000);
    for elements in [unknown, named + &absent] {
        let error = Folder::new(&[]).load(&around(&elements), &[]).unwrap_err();
        assert_eq!(error.faults().len(), 1001);
        assert_eq!(error.faults()[1000].message, "has at least these 1000 faults; there may be more");
        assert!(error.to_string().len() < 10_000_000, "lists of names do not grow");
    }
}

#[test]
fn one_point_for_all_corners_is_no_square_of_their_number() {
    const CORNERS: usize = 120_000;
    let mut text = String::from("v 0 0 0\nv 1 0 0\nv 0 1 0\n");
    (0..CORNERS).for_each(|i| writeln!(text, "vt 0.{i} 0").unwrap());
    (1..=CORNERS).for_each(|i| writeln!(text, "f 1/{i} 2/1 3/1").unwrap());
    // and once more: vertices that are known are found again
    (1..=CORNERS).for_each(|i| writeln!(text, "f 1/{i} 2/1 3/1").unwrap());
    let mesh = load::mesh("obj", text.as_bytes()).unwrap();
    assert_eq!((mesh.positions().len(), mesh.triangles.len()), (CORNERS + 2, 2 * CORNERS));
    for (i, [corner, ..]) in mesh.triangles.iter().enumerate() {
        let number = i % CORNERS;
        assert_eq!(mesh.uvs[*corner as usize].x, format!("0.{number}").parse::<f32>().unwrap(), "corner {i}");
    }
}

#[test]
fn meshes_that_unpack_to_far_more_than_they_are_are_refused() {
    let packed = |vertices: u64, bytes: usize| {
        let mut zlib = ZlibEncoder::new(vec![0x1c, 0x04, 0x04, 0x00], Compression::best());
        zlib.write_all(&0x1000u32.to_le_bytes()).unwrap();
        zlib.write_all(b"bomb\0").unwrap();
        zlib.write_all(&vertices.to_le_bytes()).unwrap();
        zlib.write_all(&1u64.to_le_bytes()).unwrap();
        zlib.write_all(&vec![0; bytes]).unwrap();
        zlib.finish().unwrap()
    };
    let bomb = packed(2_000_000, 24_000_012);
    assert!(bomb.len() < 30_000, "{} bytes", bomb.len());
    let fault = load::mesh("serialized", &bomb).unwrap_err();
    assert!(fault.ends_with("it unpacks to more than 256 times its size, which no mesh does"), "{fault}");
    // a name without end is one as well
    let mut endless = ZlibEncoder::new(vec![0x1c, 0x04, 0x04, 0x00], Compression::best());
    endless.write_all(&[1; 4 << 20]).unwrap();
    let fault = load::mesh("serialized", &endless.finish().unwrap()).unwrap_err();
    assert!(fault.ends_with("which no mesh does"), "{fault}");
    // what promises and does not hold is told from what holds too much
    let fault = load::mesh("serialized", &packed(u32::MAX.into(), 100)).unwrap_err();
    assert!(fault.ends_with("the file ends within it"), "{fault}");
}

#[test]
fn headers_of_meshes_may_promise_anything() {
    let header = |count: &str| {
        let vertex = "property float x\nproperty float y\nproperty float z\n";
        let face = "property list uchar int vertex_indices\n";
        format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex {count}\n{vertex}element face {count}\n{face}end_header\n"
        )
    };
    for count in ["4294967296", "18446744073709551615", "99999999999999999999", "-1", "1e9"] {
        let fault = load::mesh("ply", header(count).as_bytes()).unwrap_err();
        assert!(fault.starts_with("it is no readable PLY: ") && fault.len() < 400, "{count}: {fault}");
    }
}

#[test]
fn numbers_beyond_single_precision_are_faults_wherever_they_are() {
    for number in ["nan", "inf", "-inf", "1e39", "1e400", "0x10", ""] {
        let obj = format!("v {number} 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
        load::mesh("obj", obj.as_bytes()).unwrap_err();
        let ply = format!(
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n\
             property list uchar int vertex_index\nend_header\n0 0 0\n1 0 0\n0 1 {number}\n3 0 1 2\n"
        );
        load::mesh("ply", ply.as_bytes()).unwrap_err();
        let elements = format!("<shape type='sphere'><float name='radius' value='{number}'/></shape>");
        Folder::new(&[]).load(&around(&elements), &[]).unwrap_err();
    }
}

#[test]
fn lines_of_any_length_are_read() {
    let long = "1 ".repeat(5_000_000);
    let obj = format!("# {long}\nv 0 0 0 {long}\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    assert_eq!(load::mesh("obj", obj.as_bytes()).unwrap().triangles.len(), 1);
    let fault = load::mesh("obj", format!("v {}", "x".repeat(10_000_000)).as_bytes()).unwrap_err();
    assert!(fault.len() < 400, "{} bytes", fault.len());
}

/// A PNG with that size in its header and next to nothing behind it.
fn png(width: u32, height: u32) -> Vec<u8> {
    let mut bytes = b"\x89PNG\r\n\x1a\n".to_vec();
    let mut chunk = |kind: &[u8], data: &[u8]| {
        bytes.extend((data.len() as u32).to_be_bytes());
        let sealed = [kind, data].concat();
        bytes.extend(&sealed);
        bytes.extend(crc32fast::hash(&sealed).to_be_bytes());
    };
    let size = [width.to_be_bytes(), height.to_be_bytes()].concat();
    chunk(b"IHDR", &[&size[..], &[8, 2, 0, 0, 0]].concat());
    let mut zlib = ZlibEncoder::new(Vec::new(), Compression::best());
    zlib.write_all(&[0; 64]).unwrap();
    chunk(b"IDAT", &zlib.finish().unwrap());
    chunk(b"IEND", &[]);
    bytes
}

#[test]
fn pictures_may_not_be_larger_than_what_there_is_to_hold_them() {
    for (width, height) in [(65_537, 1), (1, 65_537), (65_536, 65_536), (u32::MAX, u32::MAX)] {
        let fault = load::picture(&png(width, height)).unwrap_err();
        assert!(!fault.contains("panick"), "{fault}");
        let hdr = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n");
        load::picture(hdr.as_bytes()).unwrap_err();
    }
    let fault = load::picture(&png(20_000, 20_000)).unwrap_err();
    assert!(fault.contains("bytes cannot hold its 20000 × 20000 texels"), "{fault}");
    // a real OpenEXR file with another size in its header
    let folder = Folder::new(&[]);
    let path = folder.path("a.exr");
    relt::film::exr_file::write(&path, &relt::film::Image::constant(2, 2, [1.0; 3]), &[], &[]).unwrap();
    let content = std::fs::read(&path).unwrap();
    let name = b"dataWindow\0box2i\0";
    let at = content.windows(name.len()).position(|bytes| bytes == name).unwrap() + name.len() + 4;
    for (last, message) in [(69_999, "70000 × 70000 pixels; accepted: up to 65536"), (i32::MAX, ""), (65_535, "")] {
        let mut content = content.clone();
        for i in [2, 3] {
            content[at + 4 * i..at + 4 * i + 4].copy_from_slice(&i32::to_le_bytes(last));
        }
        let fault = load::picture(&content).unwrap_err();
        assert!(fault.contains(message), "{last}: {fault}");
    }
}

/// A folder `scene`, and `out.obj` beside it.
fn around_a_scene() -> Folder {
    let folder = Folder::new(&[("out.obj", OBJ)]);
    std::fs::create_dir(folder.path("scene")).unwrap();
    std::fs::write(folder.path("scene/in.obj"), OBJ).unwrap();
    folder
}

/// What comes of a scene in the folder `scene`.
fn outcome(folder: &Folder, elements: &str, defines: &[(&str, &str)], reach: Reach) -> Result<(), String> {
    let path = folder.path("scene/scene.xml");
    std::fs::write(&path, around(elements)).unwrap();
    let defines: Vec<_> = defines.iter().map(|(name, value)| (name.to_string(), value.to_string())).collect();
    load::watched(&path, &defines, reach, &Watch::default()).map(drop).map_err(|error| error.to_string())
}

fn obj(name: &str) -> String {
    format!("<shape type='obj'><string name='filename' value='{name}'/></shape>")
}

#[track_caller]
fn assert_refused(outcome: Result<(), String>, why: &str) {
    let fault = outcome.unwrap_err();
    assert!(fault.contains("scene.xml:2:") && fault.contains(" is not read: ") && fault.contains(why), "{fault}");
}

#[test]
fn a_confined_scene_reads_its_own_folder_only() {
    let folder = around_a_scene();
    let confined = |elements: &str, defines: &[(&str, &str)]| outcome(&folder, elements, defines, Reach::Confined);
    confined(&obj("in.obj"), &[]).unwrap();
    confined(&obj("../scene/in.obj"), &[]).unwrap();
    let why = "it is outside of the scene's folder, which --confine forbids";
    let absolute = folder.path("out.obj").display().to_string();
    for name in ["../out.obj", "../absent.obj", &absolute, "/etc/passwd"] {
        assert_refused(confined(&obj(name), &[]), why);
        assert_refused(confined(&obj("$file"), &[("file", name)]), why);
    }
    let picture = "<emitter type='envmap'><string name='filename' value='../sky.exr'/></emitter>";
    let text = picture.to_owned() + &obj("in.obj");
    assert_refused(outcome(&folder, &text, &[], Reach::Confined).map_err(|fault| fault + " scene.xml:2:"), why);
}

#[test]
fn what_is_elsewhere_is_read_where_it_is_named_plainly() {
    let folder = around_a_scene();
    let plain = |elements: &str, defines: &[(&str, &str)]| outcome(&folder, elements, defines, Reach::Plain);
    let absolute = folder.path("out.obj").display().to_string();
    plain(&obj("../out.obj"), &[]).unwrap();
    plain(&obj(&absolute), &[]).unwrap();
    plain(&obj("$folder/out.obj"), &[("folder", "..")]).unwrap(); // whoever says -D says it plainly
    let default = "<default name='up' value='..'/>";
    let why = "the scene does not name it plainly";
    assert_refused(plain(&(default.to_owned() + &obj("$up/out.obj")), &[]), why);
    assert_refused(plain(&obj("&#46;&#46;/out.obj"), &[]), why);
    plain(&(default.to_owned() + &obj("$up/scene/in.obj")), &[]).unwrap();
    plain(&obj("&#46;/in.obj"), &[]).unwrap();
}

#[cfg(unix)]
#[test]
fn links_lead_out_of_no_scene_and_devices_are_not_read() {
    let folder = around_a_scene();
    std::os::unix::fs::symlink("../out.obj", folder.path("scene/link.obj")).unwrap();
    std::os::unix::fs::symlink("..", folder.path("scene/up")).unwrap();
    for name in ["link.obj", "up/out.obj"] {
        assert_refused(outcome(&folder, &obj(name), &[], Reach::Plain), "a link leads out of the scene's folder");
        assert_refused(outcome(&folder, &obj(name), &[], Reach::Confined), "which --confine forbids");
    }
    assert_refused(outcome(&folder, &obj("/dev/zero"), &[], Reach::Plain), "it is a device or a pipe");
    assert!(Path::new("/dev/zero").exists());
}

/// What comes of converting a scene of that text in the folder `scene`.
fn converted(folder: &Folder, name: &str, text: &str, reach: Reach) -> Result<(), String> {
    let (input, output) = (folder.path("scene").join(name), folder.path("scene/new.xml"));
    std::fs::write(&input, text).unwrap();
    let job = Job { input, output, defines: Vec::new(), reach, strict: false };
    convert(&job).map(drop).map_err(|error| error.to_string())
}

#[test]
fn conversions_are_confined_as_well() {
    let folder = around_a_scene();
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n\
               property list uchar int vertex_index\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    let out =
        [("out.ply", ply), ("out.pbrt", ""), ("out.spd", "400 1\n700 1\n"), ("out.xml", "<scene version='0.6.0'/>")];
    for (name, content) in out {
        std::fs::write(folder.path(name), content).unwrap();
    }
    let pbrt = [
        "Include \"../out.pbrt\"\n",
        "Shape \"plymesh\" \"string filename\" \"../out.ply\"\n",
        "LightSource \"infinite\" \"spectrum L\" \"../out.spd\"\n",
    ];
    let pbrt = pbrt.map(|directive| format!("Camera \"perspective\"\nWorldBegin\n{directive}"));
    let mitsuba = [
        "<include filename='../out.xml'/>",
        "<shape type='obj'><string name='filename' value='../out.obj'/></shape>",
        "<shape type='cube'><emitter type='area'><spectrum name='radiance' filename='../out.spd'/></emitter></shape>",
    ];
    let mitsuba = mitsuba.map(|elements| format!("<scene version='0.6.0'>{elements}</scene>"));
    let cases = pbrt.map(|text| ("a.pbrt", text)).into_iter().chain(mitsuba.map(|text| ("a.xml", text)));
    for (name, text) in cases {
        converted(&folder, name, &text, Reach::Plain).unwrap_or_else(|fault| panic!("{text}\n{fault}"));
        let fault = converted(&folder, name, &text, Reach::Confined).unwrap_err();
        let file = fault.contains("out.");
        assert!(
            file && fault.contains("it is outside of the scene's folder, which --confine forbids"),
            "{text}\n{fault}"
        );
    }
    let hidden = "<scene version='0.6.0'><default name='up' value='..'/><include filename='$up/out.xml'/></scene>";
    let fault = converted(&folder, "a.xml", hidden, Reach::Plain).unwrap_err();
    assert!(fault.contains("the scene does not name it plainly"), "{fault}");
}

#[test]
fn files_that_include_one_another_many_times_over_come_to_an_end() {
    let folder = around_a_scene();
    // four files, each with the next one two hundred times: a billion in all
    for i in 0..4 {
        let next = format!("Include \"{}.pbrt\"\n", i + 1).repeat(200);
        std::fs::write(folder.path(&format!("scene/{i}.pbrt")), next).unwrap();
        let next = format!("<include filename='{}.xml'/>\n", i + 1).repeat(200);
        let text = format!("<scene version='0.6.0'>{next}</scene>");
        std::fs::write(folder.path(&format!("scene/{i}.xml")), text).unwrap();
    }
    std::fs::write(folder.path("scene/4.pbrt"), "").unwrap();
    std::fs::write(folder.path("scene/4.xml"), "<scene version='0.6.0'/>").unwrap();
    for (name, first) in [("0.pbrt", "0.pbrt"), ("0.xml", "0.xml")] {
        let text = std::fs::read_to_string(folder.path("scene").join(first)).unwrap();
        let fault = converted(&folder, name, &text, Reach::Plain).unwrap_err();
        assert!(fault.contains("the scene includes more than 16384 files, each counted as often as it is"), "{name}");
        assert!(fault.len() < 1_000_000, "{} bytes", fault.len());
    }
}

#[test]
fn what_a_conversion_nests_or_saves_is_bounded() {
    let folder = around_a_scene();
    let pbrt = |directives: &str| format!("Camera \"perspective\"\nWorldBegin\n{directives}\n");
    let mix = |i: usize, of: usize| {
        format!("MakeNamedMaterial \"m{i}\" \"string type\" \"mix\" \"string materials\" [\"m{of}\" \"m{of}\"]\n")
    };
    let mixes: String = (1..40).map(|i| mix(i, i - 1)).collect();
    let parameters: String = (0..257).map(|i| format!(" \"float p{i}\" 1")).collect();
    let old = |elements: &str| format!("<scene version='0.6.0'>{elements}<sensor type='perspective'/></scene>");
    let of_itself = "<texture type='scale' id='a'><ref id='a'/></texture>\
                     <bsdf type='diffuse'><ref name='reflectance' id='a'/></bsdf>";
    let cases = [
        (
            "a.pbrt",
            pbrt(&"AttributeBegin\n".repeat(1025)),
            "AttributeBegin inside of 1024 others, which is the most accepted",
        ),
        ("a.pbrt", pbrt(&format!("Attribute \"shape\"{parameters}")), "adds more than 256 parameters"),
        ("a.pbrt", pbrt(&(mixes + "NamedMaterial \"m39\"\nShape \"sphere\"")), "or of more than 8 inside one another"),
        (
            "a.pbrt",
            pbrt(&(mix(1, 1) + "NamedMaterial \"m1\"\nShape \"sphere\"")),
            "the material is a mixture of itself",
        ),
        ("a.xml", old(of_itself), "the texture is made of itself, or of more than 8 inside one another"),
        ("a.xml", old(&"<bsdf type='twosided'>".repeat(66)), "malformed XML"),
        ("a.xml", old(&("<a>".repeat(66) + &"</a>".repeat(66))), "elements are nested deeper than 64 levels"),
    ];
    for (name, text, message) in cases {
        let fault = converted(&folder, name, &text, Reach::Plain).unwrap_err();
        assert!(fault.contains(message), "{message}\n{}", &fault[..fault.len().min(2000)]);
        assert!(fault.len() < 1_000_000, "{message}: {} bytes of messages", fault.len());
    }
}

#[test]
fn studies_do_not_grow_without_bounds() {
    let folder = Folder::new(&[]);
    let lists: String = (0..30).map(|i| format!("a{i} = [1, 2, 3]\n")).collect();
    let eight = &lists[..lists.find("a8").unwrap()];
    let entries = vec![eight; 40].join("[[method]]\n");
    for (head, method, message) in [
        ("", &lists[..], "its lists make more than 10000 methods, which is the most accepted"),
        ("", &entries[..], "there are more than 10000 methods, which is the most accepted"),
        ("seeds = 9223372036854775807", "", "`seeds` are more than 10000, which is the most accepted"),
        ("note = \"\\uD800\"", "", "a.toml:"),
    ] {
        let path = folder.path("a.toml");
        let text = format!("title = 'a'\nmpp = 1\n[[scene]]\nfile = 'a.xml'\n[[method]]\n{method}");
        std::fs::write(&path, text.replacen("mpp", &format!("{head}\nmpp"), usize::from(!head.is_empty()))).unwrap();
        let read = relt::study::file::read(&path, &|_| Ok(relt::render::Settings::default()));
        let fault = read.unwrap_err().to_string();
        assert!(fault.contains(message), "{message}\n{fault}");
    }
}
