// Decodes the messages of the WebSocket. A binary message consists of the length of a JSON header, the header, and
// data. The offsets in the header count from the start of the data.

const utf8 = new TextDecoder();

export function decode(received) {
    return typeof received === "string" ? JSON.parse(received) : decodeBinary(received);
}

function decodeBinary(buffer) {
    const length = new DataView(buffer).getUint32(0, true);
    const message = JSON.parse(utf8.decode(new Uint8Array(buffer, 4, length)));
    const begin = 4 + length;
    if (message.type === "cloud" || message.type === "model") {
        return decodeCloud(message, buffer, begin);
    }
    if (message.type === "pictures") {
        return { ...message, pictures: message.pictures.map((picture) => decodePicture(picture, buffer, begin)) };
    }
    return message;
}

function decodeCloud(message, buffer, begin) {
    return {
        ...message,
        positions: words(Int16Array, buffer, begin + message.positions, 3 * message.shown),
        intensities: bytes(buffer, begin + message.intensities, message.shown),
    };
}

function decodePicture(picture, buffer, begin) {
    const count = (picture.width ?? 0) * (picture.height ?? 0);
    if (count === 0) {
        return { ...picture, pixels: null };
    }
    const start = begin + picture.offset;
    const pixels = picture.format === "u16" ? words(Uint16Array, buffer, start, count) : bytes(buffer, start, count);
    return { ...picture, pixels };
}

const bytes = (buffer, start, count) => new Uint8Array(buffer, start, count);

// Copies the data, since views of 16-bit values must begin at even offsets.
function words(Type, buffer, start, count) {
    const view = new Type(buffer.slice(start, start + 2 * count));
    if (view.length !== count) {
        throw new RangeError(`the message ends ${count - view.length} values early`);
    }
    return view;
}
